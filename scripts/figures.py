"""Writes figures as CSV, a row at a time, so that a long measurement leaves what it has."""

import csv


class Figures:
    """A CSV file whose columns are those of its first row."""

    def __init__(self, file):
        self.file, self.writer = file, None

    def add(self, row):
        if self.writer is None:
            self.writer = csv.DictWriter(self.file, list(row))
            self.writer.writeheader()
        self.writer.writerow(row)
        self.file.flush()
