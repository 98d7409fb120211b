"""`chain`: one estimate of pose, wheels, chains and points, with full covariance."""
