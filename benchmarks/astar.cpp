// A* over a grid with moves to the eight neighbours, which cuts no corners: by Boost.Graph, and by a binary heap alone.
// A step costs its length times the mean of both cells, as in chefbotd's search; a blocked cell is infinite.

#include <algorithm>
#include <boost/graph/astar_search.hpp>
#include <boost/graph/compressed_sparse_row_graph.hpp>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <queue>
#include <utility>
#include <vector>

namespace {

struct Step {
    double cost;
};
using Cell = std::uint32_t;
using Graph = boost::compressed_sparse_row_graph<boost::directedS, boost::no_property, Step, boost::no_property, Cell, Cell>;
constexpr double NEVER = std::numeric_limits<double>::infinity();

struct Map {
    std::int64_t rows, columns;
    std::vector<float> costs;
    Graph graph;
    std::vector<double> reached, values;
    std::vector<Cell> parents;
    std::vector<boost::default_color_type> colors;
    std::vector<char> closed;

    bool is_free(std::int64_t row, std::int64_t column) const {
        return row >= 0 && column >= 0 && row < rows && column < columns && std::isfinite(costs[row * columns + column]);
    }

    template <class Take>
    void each_step(Cell from, Take take) const {
        const std::int64_t row = from / columns, column = from % columns;
        for (int down = -1; down <= 1; ++down)
            for (int across = -1; across <= 1; ++across) {
                if ((!down && !across) || !is_free(row + down, column + across)) continue;
                if (down && across && !(is_free(row + down, column) && is_free(row, column + across))) continue;
                const Cell to = (row + down) * columns + column + across;
                take(to, (down && across ? M_SQRT2 : 1.0) * 0.5 * (double(costs[from]) + double(costs[to])));
            }
    }
};

struct Octile : boost::astar_heuristic<Graph, double> {
    std::int64_t columns, row, column;
    Octile(std::int64_t columns, Cell goal) : columns(columns), row(goal / columns), column(goal % columns) {}
    double operator()(Cell cell) const {
        const double down = std::abs(cell / columns - row), across = std::abs(cell % columns - column);
        return std::max(down, across) + (M_SQRT2 - 1.0) * std::min(down, across);
    }
};

struct GoalReached {};

struct EndAtGoal : boost::default_astar_visitor {
    Cell goal;
    explicit EndAtGoal(Cell goal) : goal(goal) {}
    void examine_vertex(Cell cell, const Graph&) const {
        if (cell == goal) throw GoalReached();
    }
};

}  // namespace

extern "C" {

void* make_map(const float* costs, std::int64_t rows, std::int64_t columns) {
    const std::size_t count = rows * columns;
    auto* map = new Map{rows, columns, {costs, costs + count}, {}, std::vector<double>(count), std::vector<double>(count),
                        std::vector<Cell>(count), std::vector<boost::default_color_type>(count), std::vector<char>(count)};
    std::vector<std::pair<Cell, Cell>> edges;
    std::vector<Step> steps;
    for (Cell cell = 0; cell < count; ++cell)
        if (std::isfinite(costs[cell]))
            map->each_step(cell, [&](Cell to, double cost) {
                edges.emplace_back(cell, to);
                steps.push_back({cost});
            });
    map->graph = Graph(boost::edges_are_sorted, edges.begin(), edges.end(), steps.begin(), count);
    return map;
}

void free_map(void* map) { delete static_cast<Map*>(map); }

double search_by_boost(void* handle, Cell start, Cell goal) {
    Map& map = *static_cast<Map*>(handle);
    const auto index = boost::get(boost::vertex_index, map.graph);
    try {
        boost::astar_search(map.graph, start, Octile(map.columns, goal),
                            boost::predecessor_map(boost::make_iterator_property_map(map.parents.begin(), index))
                                .distance_map(boost::make_iterator_property_map(map.reached.begin(), index))
                                .rank_map(boost::make_iterator_property_map(map.values.begin(), index))
                                .color_map(boost::make_iterator_property_map(map.colors.begin(), index))
                                .weight_map(boost::get(&Step::cost, map.graph))
                                .visitor(EndAtGoal(goal)));
    } catch (const GoalReached&) {
        return map.reached[goal];
    }
    return NEVER;
}

double search_by_heap(void* handle, Cell start, Cell goal) {
    Map& map = *static_cast<Map*>(handle);
    const Octile octile(map.columns, goal);
    std::fill(map.reached.begin(), map.reached.end(), NEVER);
    std::fill(map.closed.begin(), map.closed.end(), 0);
    using Entry = std::pair<double, Cell>;
    std::priority_queue<Entry, std::vector<Entry>, std::greater<Entry>> open;
    map.reached[start] = 0.0;
    open.emplace(octile(start), start);
    while (!open.empty()) {
        const Cell cell = open.top().second;
        open.pop();
        if (cell == goal) return map.reached[goal];
        if (std::exchange(map.closed[cell], 1)) continue;
        map.each_step(cell, [&](Cell to, double cost) {
            const double total = map.reached[cell] + cost;
            if (total >= map.reached[to]) return;
            map.reached[to] = total;
            map.parents[to] = cell;
            open.emplace(total + octile(to), to);
        });
    }
    return NEVER;
}
}
