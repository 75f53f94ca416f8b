"""One module per task; a module without a leading underscore is a task of the same name."""
