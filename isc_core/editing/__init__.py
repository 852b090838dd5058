"""Editing a decomposed photo: light, gloss and colours. One kind of edit per file.

An edit is a function of a `Decomposition` and of its own options that returns an `edited.Edited`:
new layers; the input never changes. Arrays are linear Rec.709, frames and units those of
`scene.decomposition`. An edit at its default options returns a bit-identical image. `compositing`
transfers an edit to the photo at its full size.
"""
