"""What a candidate is not linear in: starts, times of failures, intervals, wave spectra."""
