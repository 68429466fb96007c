from .supervising import supervised as supervised
