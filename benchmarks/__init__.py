"""Speed and accuracy of vinsar's kernels against peers, in one run: `./run benchmarks`."""
