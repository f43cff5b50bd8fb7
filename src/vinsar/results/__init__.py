"""Results on disk: storage, provenance, lineage, crate, reproduction."""
