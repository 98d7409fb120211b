"""sonar_explore: a robot with nothing but sonar explores an unknown building."""
