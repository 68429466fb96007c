"""The record of a validation: its content, its files, its signature, and how it is checked."""
