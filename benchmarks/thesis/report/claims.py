"""Claims of the thesis' abstract, in this project's words and with the thesis' figures.

Citation: H. Akbar, "3D Intrinsic Scene Characteristics Extraction Framework for a Single Image",
thesis (2016).

Limits: single tables and figures of the thesis contain further figures; they were measured on data
sets that are not public.
"""

CHAOS_FINDS_OPTIMUM = (
    "Clonal selection with chaotic numbers finds the optimal thresholds in all (100 %) of its runs."
)
CHAOS_HELPS = (
    "Chaotic numbers make clonal selection more effective and faster than pseudo-random numbers, "
    "and than a particle swarm."
)
SPARSE_DIFFUSE = (
    "Sparse Coding lowers the MSE of the diffuse layer by 7.6 % compared with other methods."
)
SPARSE_SPECULAR = (
    "Sparse Coding lowers the MSE of the specular layer by 53.5 % compared with other methods."
)
MDR_HEIGHT = "MDR-SIRFS improves height by 11.4 % over SIRFS."
MDR_NORMALS = "MDR-SIRFS improves normals by 6.5 % over SIRFS."
MDR_LIGHT = "MDR-SIRFS improves light by 50.5 % over SIRFS."
MDR_SHADING = "MDR-SIRFS improves shading by 35.2 % over SIRFS."
MDR_REFLECTANCE = "MDR-SIRFS improves reflectance by 5.1 % over SIRFS."
MDR_TIME = "MDR-SIRFS runs 19.2 % faster than SIRFS."

ABSTRACT = (
    CHAOS_FINDS_OPTIMUM, CHAOS_HELPS, SPARSE_DIFFUSE, SPARSE_SPECULAR,
    MDR_HEIGHT, MDR_NORMALS, MDR_LIGHT, MDR_SHADING, MDR_REFLECTANCE, MDR_TIME,
)  # fmt: skip
