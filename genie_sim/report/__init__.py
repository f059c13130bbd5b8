"""What people look at, and ``result``, which is no page.

``result``      the protocol of results in a user's hands, which ``kinds`` fills for a run, several
                seeds, a sweep and the evaluation; and ``Comparison``, several results compared
``output``      what a run leaves besides its tables: summary, figures, page
``comparison``  the same of a comparison
``pages``       what stands on the page of a run, of several seeds, of a sweep, of a comparison
``template``    the one template of all pages, with its pieces
``replay``      the data of the replay on a run's page; ``replay.js`` draws them, with the scripts
                that it imports
"""
