"""`real-sonar`: extraction and SLAM on recorded scans of a known arena."""
