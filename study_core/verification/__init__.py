"""Verifying each stored step of a session alone, where it can't be derived again to the last bit.

On another type of processor sums are rounded otherwise, and one flipped acceptance of the sampler changes all that
follows. What a step says can be checked all the same, given what it started from: a query against the *stored* samples,
a drive against the *stored* weights, a posterior against the stored answers. What is compared, and how closely:

- the plan, the names of the random streams, repeats, and queries that are everybody's: exactly;
- features of the stored controls, scores, and the choice among the stored samples: to 1e-9;
- controls: no local search from them finds a reward that is more than 1e-6 better. A search from random starts finds a
  local optimum, and which one may depend on the processor;
- means of posteriors: within the Monte Carlo error of chains of other random numbers.

The entry is `verification.session.Verifier`.
"""
