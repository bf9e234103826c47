"""Control laws as data: a file that can be read, compared, linearised and flown."""
