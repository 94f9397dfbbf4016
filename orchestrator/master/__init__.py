"""How a system is stepped: instances, order, loop, table."""
