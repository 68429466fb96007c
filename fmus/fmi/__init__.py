"""The FMI 2.0 face of a component: model description and slave, from its declaration alone."""
