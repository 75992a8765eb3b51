"""The paper's networks as simulators: message passing with a state on every edge."""
