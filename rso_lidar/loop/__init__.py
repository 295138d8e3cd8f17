"""The loop: adapters that put a `Simulation` behind an interface of others, such as an environment of Gymnasium."""
