"""A boat with water jets."""
