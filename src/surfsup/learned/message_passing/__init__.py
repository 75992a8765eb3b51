"""The paper's simulators: graph networks with a latent vector on every node and every edge."""
