"""The model beside a recording: residuals, noise floor, fits, and where the model fails."""
