"""Every table and figure of the thesis, regenerated on open data, beside what the thesis claims:
`isc thesis`.

Citation: H. Akbar, "3D Intrinsic Scene Characteristics Extraction Framework for a Single Image",
thesis (2016).
"""
