"""Reads Prometheus' text format from stdin with prometheus_client's parser, and prints a line per sample."""

import sys

from prometheus_client.parser import text_string_to_metric_families

for family in text_string_to_metric_families(sys.stdin.read()):
    for sample in family.samples:
        labels = " ".join(f"{name}={value}" for name, value in sorted(sample.labels.items()))
        print(family.type, sample.name, labels, sample.value, sep="\t")
