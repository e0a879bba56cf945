"""What is seen: figures drawn from labelled datasets."""
