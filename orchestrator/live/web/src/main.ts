// The page: it reads what Python has put into it, runs the preset that is opened, and draws it.
export {};
