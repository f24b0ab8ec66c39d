"""How fast it is: measurements that anyone can repeat on their own machine."""
