// Types of the arrays that cross the border to Python.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <limits>
#include <stdexcept>
#include <string>

#include "isa/isa.hpp"
#include "sph/collision.hpp"

namespace nb = nanobind;
using namespace nb::literals;

template <typename Value, typename Shape>
using Array = nb::ndarray<Value, Shape, nb::c_contig, nb::device::cpu>;

// Input arrays are const; arrays named New... are written to.
using Weight = Array<const float, nb::ndim<2>>;
using NewWeight = Array<float, nb::ndim<2>>;
using Vector = Array<const float, nb::shape<3>>;
using Matrix3 = Array<const float, nb::shape<3, 3>>;
using Vectors = Array<const float, nb::shape<-1, 3>>;
using NewVectors = Array<float, nb::shape<-1, 3>>;
using Values = Array<const float, nb::ndim<1>>;
using NewValues = Array<float, nb::ndim<1>>;
using Fours = Array<const float, nb::shape<-1, 4>>;
using NewFours = Array<float, nb::shape<-1, 4>>;
using Flags = Array<const bool, nb::ndim<1>>;
using NewFlags = Array<bool, nb::ndim<1>>;
using Indices = Array<const int64_t, nb::ndim<1>>;
using NewIndices = Array<int64_t, nb::ndim<1>>;
using SmallIndices = Array<const int32_t, nb::ndim<1>>;
using Points = Array<const double, nb::shape<-1, 3>>;
using NewPoints = Array<double, nb::shape<-1, 3>>;
using Lengths = Array<const double, nb::ndim<1>>;
using NewLengths = Array<double, nb::ndim<1>>;
using Faces = Array<const int64_t, nb::shape<-1, 3>>;

// An argument that is never converted: writes to a converted copy would be lost.
inline auto array(const char* name) { return nb::arg(name).noconvert(); }

inline void expect(size_t rows, size_t count, const char* name) {
    if (rows != count)
        throw std::invalid_argument(std::string(name) + " has " + std::to_string(rows) + " rows, but must have " +
                                    std::to_string(count));
}

// The product of three positive sizes, or -1 where it exceeds what 62 bits hold.
template <typename Size>
int64_t product_of(const Size* sizes) {
    int64_t product = 1;
    for (int axis = 0; axis < 3; ++axis) {
        if (sizes[axis] < 1 || sizes[axis] > (int64_t{1} << 62) / product) return -1;
        product *= sizes[axis];
    }
    return product;
}

// Neighbor lists index the particles, so both arrays are read once before.
inline void expect_graph(const Indices& starts, const Indices& senders) {
    const auto count = static_cast<int64_t>(starts.shape(0)) - 1, edges = static_cast<int64_t>(senders.shape(0));
    if (count < 0 || count >= std::numeric_limits<int32_t>::max() || edges > std::numeric_limits<int32_t>::max())
        throw std::invalid_argument("starts must have one entry more than there are particles");
    bool right = starts.data()[0] == 0 && starts.data()[count] == edges;
    for (int64_t i = 0; i < count; ++i) right = right && starts.data()[i] <= starts.data()[i + 1];
    int64_t lowest = 0, highest = -1;
    for (int64_t e = 0; e < edges; ++e) {
        lowest = std::min(lowest, senders.data()[e]);
        highest = std::max(highest, senders.data()[e]);
    }
    if (!right || lowest < 0 || highest >= count)
        throw std::invalid_argument("starts must grow from 0 to the number of edges, and senders be particles");
}

// A query of a native solid or of a Python function that writes distances and normals; empty for None.
surfsup::SolidQuery solid_query(const nb::object& solid, const surfsup::Isa& isa, int threads);

void add_solids(nb::module_& module);
void add_solver(nb::module_& module);
void add_networks(nb::module_& module);
void add_message_passing(nb::module_& module);
