"""The plugins that come with mjplug, one module or package each; they use only mjplug's public plugin API."""
