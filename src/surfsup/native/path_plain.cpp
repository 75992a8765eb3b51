// For every processor.
#define PATH path_plain
#include "search_path.hpp"
#include "sweeps_path.hpp"
#include "network_path.hpp"
#include "convolution_path.hpp"
#include "solid_path.hpp"
#include "field_path.hpp"

namespace surfsup {
static bool supported() { return true; }
const Path plain = {"plain", supported, PATH::ROWS, PATH::scratch, PATH::look, PATH::approach, PATH::leave, PATH::encode, PATH::layer, PATH::finish,
                     PATH::convolve, PATH::convolve_back, PATH::weigh, PATH::within, sizeof(PATH::Search), PATH::distance, PATH::ask_field, PATH::field_scratch};
}  // namespace surfsup
