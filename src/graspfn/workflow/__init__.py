"""The plumbing of the stages: atomic files, per-object shards, parallel maps. It cannot change a result."""
