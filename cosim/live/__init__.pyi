from .page_file import write_live_page as write_live_page
