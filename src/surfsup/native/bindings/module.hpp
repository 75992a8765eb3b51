// What the files that show the C++ to Python share.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <stdexcept>
#include <string>

#include "sph/frame.hpp"
#include "sph/collision.hpp"

namespace nb = nanobind;
using namespace nb::literals;

using Weight = nb::ndarray<const float, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Bias = nb::ndarray<const float, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Vectors = nb::ndarray<const float, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using NewVectors = nb::ndarray<float, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using Turn = nb::ndarray<const float, nb::shape<3, 3>, nb::c_contig, nb::device::cpu>;
using Whole = nb::ndarray<const int32_t, nb::shape<-1>, nb::c_contig, nb::device::cpu>;
using Nodes = nb::ndarray<const float, nb::shape<-1, 2, surfsup::NODES>, nb::c_contig, nb::device::cpu>;
using NewActions = nb::ndarray<float, nb::shape<-1, surfsup::ACTIONS>, nb::c_contig, nb::device::cpu>;
using NewSurroundings = nb::ndarray<float, nb::shape<-1, surfsup::SURROUNDINGS>, nb::c_contig, nb::device::cpu>;
using Values = nb::ndarray<const float, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Starts = nb::ndarray<const int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Indices = Starts;
using Kernels = nb::ndarray<const float, nb::shape<-1, surfsup::KERNELS>, nb::c_contig, nb::device::cpu>;
using NewWeight = nb::ndarray<float, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Fours = nb::ndarray<const float, nb::shape<-1, 4>, nb::c_contig, nb::device::cpu>;
using NewFours = nb::ndarray<float, nb::shape<-1, 4>, nb::c_contig, nb::device::cpu>;
using Sums = nb::ndarray<const float, nb::shape<-1, surfsup::KERNELS, 4>, nb::c_contig, nb::device::cpu>;
using NewSums = nb::ndarray<float, nb::shape<-1, surfsup::KERNELS, 4>, nb::c_contig, nb::device::cpu>;
using NewFlags = nb::ndarray<bool, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Flags = nb::ndarray<const bool, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using NewValues = nb::ndarray<float, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Vector = nb::ndarray<const float, nb::shape<3>, nb::c_contig, nb::device::cpu>;
using Points = nb::ndarray<const double, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using NewPoints = nb::ndarray<double, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using Lengths = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using NewLengths = nb::ndarray<double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Faces = nb::ndarray<const int64_t, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using NewIndices = nb::ndarray<int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

// An argument that is never converted: what is written to a copy would be lost.
inline auto array(const char* name) { return nb::arg(name).noconvert(); }

inline void expect(size_t rows, size_t count, const char* name) {
    if (rows != count)
        throw std::invalid_argument(std::string(name) + " has " + std::to_string(rows) + " rows, but must have " +
                                    std::to_string(count));
}

// Throws std::invalid_argument where the processor cannot go it.
const surfsup::Isa& isa_of(const std::string& name);

// Whom to ask for distances: a native solid, a function of Python's that writes what it knows, or nobody.
surfsup::Ask ask_of(const nb::object& solid, const surfsup::Isa& isa, int threads);

// Shows solids, meshes and maps.
void add_solids(nb::module_& module);
