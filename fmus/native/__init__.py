"""Components as machine code: FMUs without Python at run time, and plain C, from the same source.

:mod:`.program` records a component's functions, :mod:`.c_text` and :mod:`.model_source` write them as C,
:mod:`.native_fmu` puts them behind an FMI face (``face.c``) and into an archive.
"""
