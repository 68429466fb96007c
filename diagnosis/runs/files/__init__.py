"""Files of any form as runs."""
