"""mjplug_schemas: ROS 2 interfaces as pydantic models, with their CDR, JSON, `.msg` text, type hashes and names."""
