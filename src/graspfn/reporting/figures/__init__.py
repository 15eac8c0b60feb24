"""The figures of a report, a file for each or for each family; `registry` draws them all."""
