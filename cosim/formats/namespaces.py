"""XML namespaces, file names and annotation types of the SSP 1.0 and OSP standards."""

# SSP 1.0: an archive with one structure, FMUs and parameter sets.
SSP_STRUCTURE = "SystemStructure.ssd"
SSP_RESOURCES = "resources"
SSV = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"
SSC = "http://ssp-standard.org/SSP1/SystemStructureCommon"
SSM = "http://ssp-standard.org/SSP1/SystemStructureParameterMapping"
# By the prefixes that the files use.
SSP_SPACES = {
    "ssd": "http://ssp-standard.org/SSP1/SystemStructureDescription",
    "ssc": SSC,
    "ssv": SSV,
    "osp": "http://opensimulationplatform.com/SSP/OSPAnnotations",
}
OSP_ANNOTATION = "com.opensimulationplatform"
FMU_TYPE = "application/x-fmu-sharedlibrary"

# OSP: a directory with one structure, FMUs, model descriptions and scenario files.
OSP_STRUCTURE = "OspSystemStructure.xml"
OSP_SCENARIOS = "scenarios"  # the folder in which the demo app looks for scenario files
OSP_SPACE = "http://opensimulationplatform.com/MSMI/OSPSystemStructure"
OSP_MODELS = "https://open-simulation-platform.com/OspModelDescription/1.0.0"
