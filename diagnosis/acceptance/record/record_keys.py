"""What each record says of itself."""

FORM = "cybership validation record 2"
STANDING = (
    "This record uses terms of ASME V&V 20, ITTC 7.5-02-06-03 and DNV-RP-0513. It does not claim "
    "conformity with them."
)
REFERENCES = (
    "ASME V&V 20-2009: Standard for Verification and Validation in Computational Fluid Dynamics "
    "and Heat Transfer (comparison error E, u_num, u_input, u_D, u_val).",
    "ITTC Recommended Procedures 7.5-02-06-03: Validation of Manoeuvring Simulation Models "
    "(documentation of a model and of its validation data).",
    "DNV-RP-0513: Assurance of simulation models (criteria before the comparison, intended use, "
    "traceable records).",
    "JCGM 100:2008 (GUM): Guide to the expression of uncertainty in measurement (standard and expanded "
    "uncertainty).",
)
