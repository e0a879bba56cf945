"""Expressions in text: read, differentiated and turned into code."""
