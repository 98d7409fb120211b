"""docs/conformance.md: the paper sentence by sentence beside the code that carries it out."""
