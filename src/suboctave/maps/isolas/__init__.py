"""Isolas: found, mapped over a second parameter, tabulated."""
