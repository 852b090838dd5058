"""Commands of `isc` that come with the generator, one per module, as entry points of the group
`isc.commands`.
"""
