"""What is known or estimated of a scene."""
