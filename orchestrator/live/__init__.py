"""The closed loop in a web page: its program in WebAssembly, and what shows its rows."""
