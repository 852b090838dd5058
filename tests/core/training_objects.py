"""The objects of the training half of the MIT-Berkeley set."""

TRAINING_OBJECTS = (
    "apple",
    "box",
    "cup1",
    "dinosaur",
    "frog1",
    "panther",
    "paper1",
    "phone",
    "squirrel",
    "teabag2",
)
