"""The record of a validation: its content, its files, its signature, and how it is checked."""

# Names of the files of a record.
RECORD, PAGE, PDF, SIGNATURE = (f"validation.{kind}" for kind in ("json", "html", "pdf", "sig"))
FILES = (RECORD, PAGE, PDF, SIGNATURE)
