from .watching import watched as watched
