"""The vehicle and its controllers by the paper's names: signals, indices, certificates, gains."""
