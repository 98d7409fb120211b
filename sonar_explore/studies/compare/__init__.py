"""`compare`: every SLAM on the same recorded drives, beside an oracle that is told what is what."""
