"""Which stable motions coexist over frequency and a parameter."""
