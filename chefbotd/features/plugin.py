"""The names that plug-ins import; a plug-in is the simplest component (``chefbotd.component``)."""

from chefbotd.component import PLUGIN_API_VERSION, Plugin, PluginContext

API_VERSION = PLUGIN_API_VERSION

__all__ = ["API_VERSION", "Plugin", "PluginContext"]
