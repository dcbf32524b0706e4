"""A multi-scale graph for a graph network: the edges of every level, and the links between levels.

Plain arrays of `hierarchy.graph` and `hierarchy.assignment`; with torch_geometric at hand they become a `Data` object.
As a stand-in for learned messages, a field is averaged over neighbours: on the mesh alone, and with a trip over the
coarse graphs, which carries it across the domain in one round.

Run: python examples/multiscale_graph.py [nodes] [picture.png]
"""

import sys

import matplotlib as mpl
import numpy as np

import coarsen

mpl.use("agg")
import matplotlib.pyplot as plt
from matplotlib.collections import LineCollection


def averaged(graph, x):
    """One round of messages: the mean of the neighbours."""
    source, target = graph.edge_index
    count = np.bincount(target, minlength=len(x))
    return np.bincount(target, x[source], minlength=len(x)) / count


def data_object(graph, x):
    """Return torch_geometric's `Data` of a level, or None where the library is not there."""
    try:
        import torch
        from torch_geometric.data import Data
    except ImportError:
        return None
    return Data(
        x=torch.from_numpy(x[:, None]),
        edge_index=torch.from_numpy(graph.edge_index),
        edge_attr=torch.from_numpy(graph.relative),
    )


def main(n=5000, picture="multiscale_graph.png"):
    """Build the graphs, print their sizes, draw them; return how far a message came, without and with coarse levels."""
    h = coarsen.hierarchy(coarsen.gallery.plate_with_holes(n, (2, 2)), features="auto")
    graphs = [h.graph(i) for i in range(len(h))]
    links = [h.assignment(i) for i in range(1, len(h))]
    print(f"{'level':>6} {'nodes':>7} {'edges':>7} {'mean length':>12} {'links up':>9}")
    for i, (level, graph) in enumerate(zip(h, graphs, strict=True)):
        length = np.linalg.norm(graph.relative, axis=1).mean()
        up = links[i - 1].edge_index.shape[1] if i else 0
        print(f"{i:6d} {level.mesh.n_points:7d} {graph.edge_index.shape[1]:7d} {length:12.4f} {up:9d}")

    # a message from the node nearest to the lower left corner: one round on every level, up and down again
    x = np.zeros(h[0].mesh.n_points)
    x[np.argmin(h[0].mesh.points.sum(axis=1))] = 1.0
    alone = averaged(graphs[0], x)
    fields = [x]
    for (fine, coarse), weights in links:
        fields.append(np.bincount(coarse, weights * fields[-1][fine], minlength=coarse.max() + 1))
    passed = averaged(graphs[-1], fields[-1])
    for i in range(len(links), 0, -1):
        (fine, coarse), weights = links[i - 1]
        down = np.bincount(fine, weights * passed[coarse])
        passed = averaged(graphs[i - 1], down + fields[i - 1])
    reached = [int(np.count_nonzero(field)) for field in (alone, passed)]
    print(f"one round reaches {reached[0]} nodes on the mesh alone, {reached[1]} over all levels")
    data = data_object(graphs[0], x)
    print("torch_geometric is not there" if data is None else data)

    figure, axes = plt.subplots(1, 3, figsize=(15, 5))
    for ax, i in zip(axes, np.linspace(0, len(h) - 1, 3).astype(int), strict=True):
        points, (source, target) = h[i].mesh.points, graphs[i].edge_index
        ax.add_collection(LineCollection(np.stack([points[source], points[target]], axis=1), lw=0.3, color="black"))
        ax.autoscale()
        ax.set_title(f"level {i}: {len(points)} nodes")
        ax.set_aspect("equal")
    figure.savefig(picture, dpi=100)
    plt.close(figure)
    return reached


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 5000, *sys.argv[2:3])
