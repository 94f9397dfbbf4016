"""The closed loop in a web page: components in WebAssembly, stepped by a master in TypeScript."""
