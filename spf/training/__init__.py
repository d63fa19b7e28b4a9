"""Train the network that proposes hands, on nothing but our own renders. The only package that uses torch."""
