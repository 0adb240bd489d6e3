// The Python module `ffseg.native._core`: arrays in, arrays out.
#include "bindings.hpp"

NB_MODULE(_core, m) {
    m.doc() = "Native loops of ffseg: arrays in, arrays out; no files, no policy.";
    bind_edges(m);
    bind_evidence(m);
    bind_freeform(m);
    bind_raster(m);
    bind_region(m);
    bind_text(m);
    bind_levelset(m);
    bind_measures(m);
    bind_compression(m);
    bind_pairs(m);
    bind_paper(m);
    bind_snake(m);
}
