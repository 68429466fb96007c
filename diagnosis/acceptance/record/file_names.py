"""Names of the files of a validation record."""

RECORD, PAGE, PDF, SIGNATURE = (f"validation.{kind}" for kind in ("json", "html", "pdf", "sig"))
FILES = (RECORD, PAGE, PDF, SIGNATURE)
