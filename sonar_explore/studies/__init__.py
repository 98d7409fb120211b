"""The paper's runs as studies: many seeds, both arms paired, judged against the truth."""
