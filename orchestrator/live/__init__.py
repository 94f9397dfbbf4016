"""The closed loop in a web page: programs in WebAssembly run it, and charts show its rows."""
