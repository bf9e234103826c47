"""What a DataFlash log tells, of columns that are given: messages by name, without a file."""

import numpy as np


class Rows(dict):
    """A table: columns by name at `time`, (n_message,) s."""

    def __init__(self, time, **columns):
        super().__init__({name: np.asarray(one) for name, one in columns.items()})
        self.time, self.columns = np.asarray(time, np.float64), tuple(columns)

    def __len__(self):
        return self.time.size


class Told(dict):
    """A log: tables by name, or by a message's name their sensors' tables."""

    begins, named, path, damage = 1.0, "", "a.bin", ""

    def __init__(self, own=None, texts=(), **tables):
        super().__init__(tables)
        self._own, self._texts = own or {}, texts

    def has(self, name, *fields):
        return name in self and {*fields} <= {*self.table(name, self.instances(name)[0]).columns}

    def table(self, name, instance=0):
        return self[name] if isinstance(self[name], Rows) else self[name][instance]

    def instances(self, name):
        return (0,) if isinstance(self[name], Rows) else tuple(self[name])

    def arrays(self, name, field):
        return self[name][field]

    def parameters(self, at=None):
        return self._own(at) if callable(self._own) else self._own

    def messages(self):
        return self._texts
