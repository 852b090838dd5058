"""Commands of `isc` that come with the generator, one a file, as entry points of the group
`isc.commands`.
"""
