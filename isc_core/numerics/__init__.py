"""Deterministic numerics: linear algebra, optimisation, compiled loops and threads.

The rule: the same input gives the same bytes on any number of threads. SIRFS has many minima, so
that a rounding difference early on leads to another shape. This has three consequences.

Sums. A BLAS or LAPACK routine splits a product of matrices among its threads and adds the parts in
an order that depends on their number. Sums that affect a result are therefore `np.einsum` without
`optimize` (one thread, one order), `ndarray.sum`, or a compiled loop; never ``@``, `np.dot`,
`np.linalg.inv` or `np.linalg.solve` on arrays large enough for BLAS to split. Small systems are
solved by `linear.solve_linear`. Those routines also start the library's threads at every call,
which takes longer than the products of a few columns.

Threads. `thread_pool.ThreadPool` runs tasks that write to disjoint memory. Work is split into
parts whose number depends on the data alone, and partial sums are added in the order of the parts.

Optimiser. `lbfgs` is our own because SciPy's L-BFGS-B works in float64 only, cannot be suspended,
and takes its inner products from BLAS. Ours works in place in float32 or float64, takes every
product as a float64 sum in one order, and can be suspended and resumed.

Do not replace these by shorter library calls without comparing the bytes on 1 and on 2 threads.
"""
