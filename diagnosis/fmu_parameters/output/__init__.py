"""A calibration as files, text and page, and ``learn`` that makes them."""
