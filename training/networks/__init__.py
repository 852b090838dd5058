"""One program per network of `isc_core.networks`, under the same name."""
