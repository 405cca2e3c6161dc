"""Pictures of datasets and runs, and the figures of the paper."""
