"""What one does with a decomposed photo: other lights, other gloss, other colours. One kind of edit
a file.

An edit is a function of a `Decomposition` and of its own options that returns `edited.Edited`: new
layers, never a changed input. Arrays are linear Rec.709, frames and units those of `decomposition`.
An edit that asks for nothing returns the image bit by bit. `compositing` brings an edit back into
the photo at its full size.
"""
