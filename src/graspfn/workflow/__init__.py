"""The plumbing of the stages: seeds, atomic files, per-object shards, parallel maps."""
